"""What a sweep leaves on disk: parts, manifests, agents."""

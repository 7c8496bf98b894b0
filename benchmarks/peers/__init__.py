"""The same task done with well-known libraries; they come with the extra `peers`, which `make bench` installs."""

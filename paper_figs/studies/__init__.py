"""What studies of many seeds or readings conclude: tables and figures from their results."""

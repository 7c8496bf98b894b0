"""The paper's figures from result files. Drawing is a function of results and never trains."""

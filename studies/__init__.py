"""Studies over many simulated experiments, which show how far the answers can be believed."""

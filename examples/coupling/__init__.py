"""The theory of two coupled rigs, and the study that measures it."""

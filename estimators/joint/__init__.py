"""The joint observer: all parameters of a black box at once, with their covariance."""

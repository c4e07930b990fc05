"""The well-posed contact model of the brush."""

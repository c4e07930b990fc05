"""The plant as the searches see it: matrices, scaling, parts, prices, regions."""

"""The sampled loop: what it does between its samples, its norm and its proof."""

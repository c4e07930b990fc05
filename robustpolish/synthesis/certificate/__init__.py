"""What is proven of a closed loop: its poles, its norm, and the matrices that show both."""

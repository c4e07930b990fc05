"""Static, fixed-order and structured controllers."""

"""One Lyapunov matrix for several specifications."""

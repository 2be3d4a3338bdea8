"""What people decided, on disk: saved at every step, with its history."""

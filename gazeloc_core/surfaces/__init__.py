"""The scan's surface: rays, renders, points, what the screen shows of it."""

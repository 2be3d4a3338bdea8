"""Who is here: pages that come and go, what they show of each other, the view that each comes back to."""

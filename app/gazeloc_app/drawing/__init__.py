"""The process that draws pictures and casts rays, and what is made there."""

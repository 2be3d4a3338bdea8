"""Long work: the queue, the process that does it, what it tells, and the tasks themselves."""

"""From keypoints to an alignment that proves itself, and on to a refined one."""

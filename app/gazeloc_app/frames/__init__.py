"""The recording's frames: marks, problems, playing, looking through, the timeline."""

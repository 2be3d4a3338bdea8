"""The rooms behind `gazeloc_core.synthetic`: geometry, light, cameras and the files of a made-up capture."""

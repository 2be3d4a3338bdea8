"""Files on disk, without any knowledge of the domain: hashes, locks, journals, artifacts, what users' files can be."""

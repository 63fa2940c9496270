"""A whole integration: its loop, its times, its progress, its checkpoints, and what watches for stalls."""

"""Reports: markdown and one self-contained page from a store; nothing is run again."""

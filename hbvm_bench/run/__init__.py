"""How cases run: side by side in processes under hard limits, then timed one at a time."""

"""From a function of symbols to a graph of operations, with messages that name the user's line."""

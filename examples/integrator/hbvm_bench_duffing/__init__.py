"""A problem and a method for hbvm-bench, from outside."""

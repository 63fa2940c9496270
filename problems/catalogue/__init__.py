"""The built-in problems: a file ``NAME.py`` with a function ``NAME`` decorated by `problems.entry` is one.

Files that start with an underscore have what several of them share.
"""

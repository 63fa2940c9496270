"""Settings of all tests."""

import os

from hypothesis import settings

# What decides whether a change lands is the same every time; at home hypothesis goes on looking.
settings.register_profile("ci", derandomize=True, deadline=None, print_blob=True)
settings.register_profile("home", deadline=None)
settings.load_profile("ci" if os.environ.get("CI") else "home")

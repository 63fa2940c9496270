"""Steps of varying length on the compiled kernel."""

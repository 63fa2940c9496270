"""heyoka's Taylor integrator behind the stepper protocol."""

"""What may lie inside a step: events and what they change, switching surfaces, contacts, jumps."""

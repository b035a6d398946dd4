"""How long a run will take and how wrong it will be, from its modified equation."""

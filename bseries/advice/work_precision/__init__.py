"""Work and precision: what accuracy costs, and the cheapest method and step."""

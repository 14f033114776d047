"""Who may say what on the bus: certificates of the roles, and the rights that go with them."""

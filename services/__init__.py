"""The skin around the physics: files, screens, configuration, nodes and the bus."""

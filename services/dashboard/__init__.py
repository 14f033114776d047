"""The page and the terminal that show a running machine; neither can hold it up."""

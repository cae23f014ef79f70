"""What the site has from the code itself: tables of options, topics, parameters and equations."""

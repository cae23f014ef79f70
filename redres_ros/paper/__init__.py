"""What the paper shows: schemes of second order, experiments, figures and claims."""

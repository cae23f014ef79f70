"""The paper: second-order schemes, experiments, figures and claims."""

"""The paper's examples, figures and Table I."""

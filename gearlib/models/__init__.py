"""Models: parameters in SI, their ratios, their equations of motion; `model` is the protocol."""

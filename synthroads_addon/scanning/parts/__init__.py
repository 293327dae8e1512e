"""The parts of a scan's plan: what is decided once about emission, reflection, air, reception, relief, layers, run."""

"""What LandXML and IFC files say of a road beside its line."""

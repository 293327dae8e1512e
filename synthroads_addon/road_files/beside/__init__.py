"""Parts of a road beside its line that LandXML and our own IFC say."""

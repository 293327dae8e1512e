#!/bin/bash
# ifcopenshell calls the schema of a model that it has opened "IFC4X3", and refuses a file that names its schema so: it
# opens "IFC4X3_ADD2" alone. IFC 4.3's other names, under which most files with alignments were written (IFC4X3,
# IFC4X3_ADD1, IFC4X3_RC3, IFC4X3_RC4), end in "Unsupported schema", though the entities used are the same in all. So a
# program that writes model.schema into a header writes a file that ifcopenshell doesn't read again; what the header
# has is model.schema_identifier.
# Seen with ifcopenshell 0.9.0.post1.
# Guess before: the name that a model gives its schema is one that it opens, and candidates open as what they became.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet --disable-pip-version-check "ifcopenshell==0.9.0.post1"
cat > "$folder/open.py" <<'PYTHON'
import sys

import ifcopenshell

HEADER = "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('a','',(''),(''),'','','');\n"
BODY = "ENDSEC;\nDATA;\n#1=IFCCARTESIANPOINT((0.,0.,0.));\nENDSEC;\nEND-ISO-10303-21;\n"
print(ifcopenshell.version)
for name in ("IFC4X3_ADD2", "IFC4X3", "IFC4X3_ADD1", "IFC4X3_RC3", "IFC4X3_RC4"):
    path = f"{sys.argv[1]}/{name}.ifc"
    with open(path, "w", encoding="ascii") as file:
        file.write(f"{HEADER}FILE_SCHEMA(('{name}'));\n{BODY}")
    try:
        model = ifcopenshell.open(path)
        print(name, "opens as", model.schema, model.schema_identifier)
    except Exception as error:
        print(name, type(error).__name__)
PYTHON
seen=$("$folder/venv/bin/python" "$folder/open.py" "$folder")
echo "$seen"
[ "$seen" = "0.9.0.post1
IFC4X3_ADD2 opens as IFC4X3 IFC4X3_ADD2
IFC4X3 SchemaError
IFC4X3_ADD1 SchemaError
IFC4X3_RC3 SchemaError
IFC4X3_RC4 SchemaError" ]

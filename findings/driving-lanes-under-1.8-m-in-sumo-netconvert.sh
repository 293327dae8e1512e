#!/bin/bash
# SUMO's netconvert takes driving lanes of OpenDRIVE that are narrower than 1.8 m for lanes of emergency vehicles and
# authorities alone: no passenger car may use them, the lane stays in the network, exit code 0, no warning. The limit is
# --opendrive.min-width (1.8 m), which by its help is for finding the start or end of lanes of variable width; these
# have the same width from end to end. A country road of 3.5 m (two lanes of 1.75 m) becomes one that no car drives.
# Remedy: netconvert --opendrive.min-width 1.5 (or below the narrowest lane).
# Seen with eclipse-sumo 1.28.0.
# Guess before: the lane is kept for cars, or netconvert says that it drops it.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet --disable-pip-version-check "eclipse-sumo==1.28.0"
for width in 1.75 1.85; do
    cat > "$folder/road.xodr" <<XML
<?xml version="1.0"?>
<OpenDRIVE>
  <header revMajor="1" revMinor="6"/>
  <road name="r" length="100.0" id="1" junction="-1">
    <type s="0.0" type="rural"/>
    <planView><geometry s="0.0" x="0.0" y="0.0" hdg="0.0" length="100.0"><line/></geometry></planView>
    <lanes><laneSection s="0.0">
      <left><lane id="1" type="driving" level="false"><width sOffset="0.0" a="$width" b="0" c="0" d="0"/></lane></left>
      <center><lane id="0" type="none" level="false"/></center>
      <right><lane id="-1" type="driving" level="false"><width sOffset="0.0" a="$width" b="0" c="0" d="0"/></lane></right>
    </laneSection></lanes>
  </road>
</OpenDRIVE>
XML
    for limit in default 1.5; do
        option=""
        [ "$limit" = default ] || option="--opendrive.min-width $limit"
        "$folder/venv/bin/netconvert" --opendrive-files "$folder/road.xodr" $option -o "$folder/road.net.xml" \
            > "$folder/said.txt" 2>&1
        grep -o '<lane id="[^:][^>]*' "$folder/road.net.xml" > "$folder/lanes.txt"
        who=cars
        if grep -q ' allow="emergency authority"' "$folder/lanes.txt"; then who="emergency vehicles alone"; fi
        echo "width $width limit $limit: $who; warnings: $(grep -ci warning "$folder/said.txt" || true)"
    done
done > "$folder/seen.txt"
cat "$folder/seen.txt"
[ "$(cat "$folder/seen.txt")" = "width 1.75 limit default: emergency vehicles alone; warnings: 0
width 1.75 limit 1.5: cars; warnings: 0
width 1.85 limit default: cars; warnings: 0
width 1.85 limit 1.5: cars; warnings: 0" ]

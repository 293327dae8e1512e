"""The built scene with its semantics as files of other programs: glTF, USD, 3D Tiles."""

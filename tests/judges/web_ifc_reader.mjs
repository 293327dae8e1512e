// Prints what web-ifc reads of an IFC file as one line of JSON: node web_ifc_reader.mjs FILE.ifc
import { readFileSync } from "node:fs";
import { IFCPRODUCT, IfcAPI, LogLevel } from "web-ifc";

const api = new IfcAPI();
await api.Init();
api.SetLogLevel(LogLevel.LOG_LEVEL_OFF);
const model = api.OpenModel(readFileSync(process.argv[2]));

function pieceOf(placed) {
  const geometry = api.GetGeometry(model, placed.geometryExpressID);
  // Each vertex has its normal behind it.
  const numbers = api.GetVertexArray(geometry.GetVertexData(), geometry.GetVertexDataSize());
  const vertices = Array.from(numbers.filter((_, index) => index % 6 < 3));
  const triangles = geometry.GetIndexDataSize() / 3;
  geometry.delete();
  return { vertices, triangles, matrix: placed.flatTransformation };
}

const meshes = {};
api.StreamAllMeshes(model, (mesh) => {
  const placed = Array.from({ length: mesh.geometries.size() }, (_, index) => mesh.geometries.get(index));
  const product = api.GetLine(model, mesh.expressID);
  const placement = api.GetWorldTransformMatrix(model, product.ObjectPlacement.value);
  meshes[product.GlobalId.value] = { placement, pieces: placed.map(pieceOf) };
});
const pointsOf = (parts) => parts.map((part) => part.points.map(({ x, y }) => [x, y]));
const alignments = api
  .GetAllAlignments(model)
  .map(({ horizontal, vertical }) => ({ horizontal: pointsOf(horizontal), vertical: pointsOf(vertical) }));
const products = api.GetLineIDsWithType(model, IFCPRODUCT, true).size();
console.log(JSON.stringify({ schema: api.GetModelSchema(model), products, meshes, alignments }));

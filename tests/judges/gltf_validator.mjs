// Prints what the Khronos glTF validator finds in a file, as JSON: issues and figures.
import fs from "node:fs";
import validator from "gltf-validator";

const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[2])), { maxIssues: 50 });
const serious = report.issues.messages.filter((issue) => issue.severity < 2);
console.log(JSON.stringify({ issues: serious, triangles: report.info.totalTriangleCount }));

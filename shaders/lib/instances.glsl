// Instances of meshes, with transforms to rel space (relative to the eye).
#ifndef INSTANCES_GLSL
#define INSTANCES_GLSL
#include "share/scene.glsl"

layout(scene, scalar) readonly buffer Instances { Instance instances[]; };
#endif

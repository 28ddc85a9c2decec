// The camera of the current sample, as a uniform block.
#ifndef VIEW_GLSL
#define VIEW_GLSL
#include "lib/camera.glsl"

layout(scene, scalar) uniform CameraBlock { Camera camera; };
#endif

// The camera of the sample that is drawn.
#ifndef VIEW_GLSL
#define VIEW_GLSL
#include "lib/camera.glsl"

layout(scene, scalar) uniform CameraBlock { Camera camera; };
#endif

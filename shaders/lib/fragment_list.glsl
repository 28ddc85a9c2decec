// Order-independent transparency by per-pixel linked lists (an A-buffer): the nodes of the lists.
// A node holds the quantities of the G-buffer for one transparent fragment. An atomic counter hands out nodes in the order
// in which fragments arrive. The reader sorts by depth, then instance and triangle, so the picture does not depend on that
// order.
// Where to read: Carpenter 1984 (A-buffer); Yang et al. 2010 (per-pixel linked lists on the GPU); RTR 4, section 5.5.
#ifndef FRAGMENT_LIST_GLSL
#define FRAGMENT_LIST_GLSL

const uint LEAST_NODE_WORDS = 15;
const uint LOBE_WORDS = 4;
const uint END_OF_LIST = 0xffffffffu;
// Layout of a node, in 32-bit words:
//   0 next   1 depth (bits)   2 instance   3 triangle   4 material | roughness << 16
//   5 base.rg   6 base.b, metallic   7 normal, octahedral   8 emissive.rg   9 emissive.b, alpha   (halves, snorms)
//   10 occlusion (16 bits)   11 to 14 packed_layers   15 to 18 packed_lobes, where the plan has it (lib/texels.glsl)
#endif

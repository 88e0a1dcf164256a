#include "server/cli/example_world.h"

#include <string_view>

namespace terrane {
namespace {

constexpr std::string_view kExampleWorld = R"(# A world of Terrane. Change anything, then:
#
#   terrane world check FILE     says everything that is wrong with it, with line and column
#   terrane world show FILE      prints the layers it gives
#   terrane slice --world FILE --from 0,0 --to 400,0 -o cut.png      shows them
#
# The same file gives the same terrain on every machine. Another seed gives another terrain of the
# same character.

format = 1              # of this file; 2 also knows rivers, folds and cave systems: see canyon.toml
name = "my world"
seed = 42               # any whole number

[terrain]               # lengths are in voxels
depth = 96              # from the bottom of the deepest layer to the surface, 2 to 4096
scale = 160             # period of the widest folds, 2 to 1048576: great is gentle, small is hilly
octaves = 3             # 1 to 6: how many ever finer folds are added; 1 if left out
layer_thickness = 24    # what thickness 1 of a material means, 0 to 4096
layer_similarity = 1.0  # multiplies every material's similarity, 0 to 16
roughness = 70          # what roughness 1 of a material means, 0 to 4096
vein_area = 48          # longest side of the square around a vein; at most 2 * plot - 2
cave_area = 56          # the same for a cave
vein_thickness = 12     # what thickness 1 of a vein's material means
cave_thickness = 14     # what thickness 1 of a cave's material means
vein_density = 0.8      # veins between two layers, on average, in the first plot; 0 to 64
cave_density = 0.3      # caves, likewise

[grid]
chunk = [32, 32, 32]    # voxels of a chunk along x, y, z; 4 to 64 each, the first equal to the last
plot = 160              # side in columns of the square by which terrain is extended, 4 to 4096
voxel_size_m = 1.0      # for clients that think in metres; 1 if left out

# Materials. A material's kind says what it is for:
#   void      what is above the ground; exactly one
#   base      the deepest layer is of these; at least one
#   regular   all other layers are of these; at least one
#   vein      lenses between two layers
#   cave      hollows between two layers
# Numbers are from 0 to 1. Three numbers are [least, best, most]: the world draws between least and
# most, most often near best. Keys that mean nothing for a kind may be left out.

[[material]]
id = 0                  # unique; the order in which materials are considered
name = "air"
color = "#cde4fa"       # red, green, blue; two hexadecimal digits each
kind = "void"

[[material]]
id = 1
name = "granite"
color = "#5b5560"
kind = "base"
thickness = [0.4, 0.6, 0.9]
roughness = [0.5, 0.7, 1.0]
similarity = 0.1        # how much a layer of it follows the one below: 0 flat on average, 1 parallel
blend = 0.0             # how far it blends into the layer below: share of its thickness

[[material]]
id = 10
name = "red sandstone"
color = "#a4533a"
kind = "regular"
alone = false           # true: never mixed with another material, and never blended
depth = [0.4, 0.8, 1.0] # where it is found: 0 is the surface, 1 the bottom
thickness = [0.3, 0.5, 0.9]
roughness = [0.2, 0.4, 0.6]
similarity = 0.85
blend = 0.3

[[material]]
id = 11
name = "limestone"
color = "#cfc6ac"
kind = "regular"
depth = [0.15, 0.5, 0.85]
thickness = [0.3, 0.5, 0.8]
roughness = [0.2, 0.3, 0.5]
similarity = 0.9
blend = 0.25

[[material]]
id = 12
name = "coal"
color = "#1b191d"
kind = "regular"
alone = true
depth = [0.3, 0.5, 0.8]
thickness = [0.06, 0.1, 0.16]
roughness = [0.1, 0.2, 0.3]
similarity = 0.95
blend = 0.0

[[material]]
id = 13
name = "loam"
color = "#7d8a4c"
kind = "regular"
depth = [0.0, 0.0, 0.25]
thickness = [0.2, 0.3, 0.5]
roughness = [0.2, 0.3, 0.5]
similarity = 0.8
blend = 0.4

[[material]]
id = 20
name = "gold"
color = "#f2c230"
# texture = "gold.png"  # optional: a file beside this one, at most 4 MiB
kind = "vein"
alone = true
area = 0.8              # share of vein_area
depth = [0.3, 0.8, 1.0]
thickness = [0.3, 0.5, 0.8]
roughness = [0.2, 0.5, 0.8] # of its outline
blend = 0.0

[[material]]
id = 30
name = "cave"
color = "#140f1a"
kind = "cave"
area = 0.9
depth = [0.3, 0.6, 1.0]
thickness = [0.3, 0.6, 0.9]
roughness = [0.2, 0.5, 0.8]

# How well materials go together: 0 hardly ever, 1 gladly, -1 never. Pairs work both ways.
[affinity]
same_layer_default = 1.0    # in one layer; 1 if left out
next_layer_default = 1.0    # one upon the other; 1 if left out
same_layer = [["red sandstone", "loam", -1]]
next_layer = [
    ["coal", "coal", -1],
    ["limestone", "limestone", 0.1],
    ["limestone", "coal", 0.6],
]
)";

}  // namespace

std::string_view example_world() {
    return kExampleWorld;
}

}  // namespace terrane

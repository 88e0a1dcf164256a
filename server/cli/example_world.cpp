#include "server/cli/example_world.h"

#include <string_view>

namespace terrane {
namespace {

constexpr std::string_view kExampleWorld = R"(# A world of Terrane. Change anything, then:
#
#   terrane world check FILE     says everything that is wrong with it, with line and column
#   terrane world show FILE      says in words what it gives, and prints its layers
#   terrane map --world FILE --rect=-1024,-1024,1024,1024 -o map.png      shows it from above
#
# The same file gives the same terrain on every machine. Another seed gives another land of the
# same character. Every key of a table but [terrain] and [grid] may be left out.

format = 2              # of this file; 1 knows layers, veins and caves between them, nothing more
name = "my world"
seed = 42               # any whole number

[terrain]               # the layers as they were laid down; lengths are in voxels
depth = 200             # from the bottom of the deepest layer to the top, 2 to 4096
scale = 90              # period of a layer's widest bumps, 2 to 1048576
octaves = 2             # 1 to 6: how many ever finer bumps are added; 1 if left out
layer_thickness = 22    # what thickness 1 of a material means, 0 to 4096
layer_similarity = 1.0  # multiplies every material's similarity, 0 to 16
roughness = 9           # what roughness 1 of a material means, 0 to 4096
vein_area = 90          # longest side of the square around a vein; at most 2 * plot - 2
cave_area = 0           # the same for a cave between two layers; see [caves] for better ones
vein_thickness = 9      # what thickness 1 of a vein's material means
cave_thickness = 0
vein_density = 0.6      # veins between two layers, on average, in the first plot; 0 to 64
cave_density = 0

[structure]             # what happened to the layers later
fold = 22               # how far they are bent up and down; 0: not at all
fold_length = 520       # columns from crest to crest
fold_direction = 0.09   # turns: where the crests run
fault_density = 0.6     # fractures in 512 x 512 columns
fault_throw = 34        # how far the rock slipped along one, at most
fault_length = 420
sheet = 4               # thickness of the minerals that fill some of them
lift = false            # true: veins lift the layers above them

[relief]                # what rivers made of the land
height = 105            # crests over rivers, at most; ends at the top of the layers. 0: no relief
ground = 72             # mean height of rivers; with `fall` no more than depth
fall = 30               # rivers run from ground + fall down to ground - fall
valley = 230            # columns from river to river
province = 900          # columns from plains to mountains
plateau = 0.35          # 0 ridges, 1 table lands
rivers = 2.2            # how wide they are; 0: dry valleys
gullies = 7             # how deep rain has cut
gully_scale = 88
gully_octaves = 4
cliffs = 0.62           # 0 to 0.8: how far hard layers stand out of soft ones
overhang = 6            # columns that hard layers lean out, at most 6
soil = 2.5              # most of it, on level ground
# sea_level = 60        # floods what lies lower
# snow_line = 150       # snow from here up, with a material of kind "snow"

[caves]                 # what water dissolved
cell = 88               # columns from node to node; 0: no cave systems
radius = 5              # of their tubes
density = 0.7           # chances, 0 to 1: that a node is there,
connect = 0.75          # of a tube to the next node,
shaft = 0.25            # of a shaft to the level above,
chamber = 0.2           # of a hall at a node,
sink = 0.1              # of an opening to the sky
levels = 4              # on so many of the most soluble layers
water_table = 3         # flooded from so far below the rivers down

[grid]
chunk = [32, 32, 32]    # voxels of a chunk along x, y, z; 4 to 64 each, the first equal to the last
plot = 160              # side in columns of the square by which terrain is extended, 4 to 4096
voxel_size_m = 1.0      # for clients that think in metres; 1 if left out

# Materials. A material's kind says what it is for:
#   void      what is above the ground; exactly one
#   base      the deepest layer is of these; at least one
#   regular   all other layers are of these; at least one
#   vein      lenses between two layers; those with area 0 fill fractures
#   cave      hollows between two layers
#   water, soil, sand, snow      what lies on the land; at most one of each
# Numbers are from 0 to 1. Three numbers are [least, best, most]: the world draws between least and
# most, most often near best. Keys that mean nothing for a kind may be left out.

[[material]]
id = 0                  # unique; the order in which materials are considered
name = "air"
color = "#cfe3f2"       # red, green, blue; two hexadecimal digits each
kind = "void"

[[material]]
id = 1
name = "granite"
color = "#5c545c"
kind = "base"
thickness = [0.5, 0.7, 0.9]
roughness = [0.2, 0.45, 0.8]
similarity = 0.5        # how much a layer of it follows the one below: 0 flat on average, 1 parallel
blend = 0.2             # how far it blends into the layer below: share of its thickness
hardness = 0.85         # hard layers stand as cliffs, soft ones lie as benches
soluble = 0             # 1: caves like it

[[material]]
id = 10
name = "limestone"
color = "#d6ccb2"
kind = "regular"
alone = false           # true: never mixed with another material, and never blended
depth = [0.0, 0.5, 1.0] # where it is found: 0 is the top, 1 the bottom
thickness = [0.5, 0.8, 1.0]
roughness = [0.2, 0.45, 0.8]
similarity = 0.93
blend = 0.06
hardness = 0.8
soluble = 1

[[material]]
id = 11
name = "shale"
color = "#686c68"
kind = "regular"
depth = [0.0, 0.5, 1.0]
thickness = [0.25, 0.4, 0.7]
roughness = [0.2, 0.45, 0.8]
similarity = 0.9
blend = 0.15
hardness = 0.12
soluble = 0.05

[[material]]
id = 12
name = "red sandstone"
color = "#b4623f"
kind = "regular"
depth = [0.0, 0.5, 1.0]
thickness = [0.4, 0.7, 1.0]
roughness = [0.2, 0.45, 0.8]
similarity = 0.92
blend = 0.08
hardness = 0.85
soluble = 0.1

[[material]]
id = 13
name = "marl"
color = "#baa470"
kind = "regular"
depth = [0.0, 0.5, 1.0]
thickness = [0.2, 0.4, 0.6]
roughness = [0.2, 0.45, 0.8]
similarity = 0.92
blend = 0.2
hardness = 0.22
soluble = 0.3

[[material]]
id = 14
name = "chalk"
color = "#ece8dc"
kind = "regular"
depth = [0.0, 0.5, 1.0]
thickness = [0.2, 0.4, 0.6]
roughness = [0.2, 0.45, 0.8]
similarity = 0.93
blend = 0.1
hardness = 0.45
soluble = 0.8

[[material]]
id = 20
name = "coal"
color = "#222024"
kind = "vein"
area = 0.5              # share of vein_area
depth = [0.0, 0.5, 1.0]
thickness = [0.3, 0.5, 0.8]
roughness = [0.2, 0.45, 0.8] # of its outline
blend = 0.1
# texture = "coal.png"  # optional: a file beside this one, at most 4 MiB

[[material]]
id = 30
name = "gold"
color = "#deaa28"
kind = "vein"
area = 0                # fills fractures
depth = [0.0, 0.5, 1.0]
thickness = [0.3, 0.5, 0.8]
roughness = [0.2, 0.45, 0.8]
blend = 0.1

[[material]]
id = 40
name = "water"
color = "#34688c"
kind = "water"

[[material]]
id = 41
name = "meadow"
color = "#687e3e"
kind = "soil"

[[material]]
id = 42
name = "sand"
color = "#cebe8c"
kind = "sand"

# How well materials go together: 0 hardly ever, 1 gladly, -1 never. Pairs work both ways.
[affinity]
same_layer_default = 0.5    # in one layer; 1 if left out
next_layer_default = 1.0    # one upon the other; 1 if left out
same_layer = [["red sandstone", "chalk", -1]]
next_layer = [
    ["limestone", "limestone", 0.02],
    ["shale", "shale", 0.02],
    ["red sandstone", "red sandstone", 0.02],
    ["marl", "marl", 0.02],
    ["chalk", "chalk", 0.02],
    ["limestone", "red sandstone", 0.35],
]
)";

}  // namespace

std::string_view example_world() {
    return kExampleWorld;
}

}  // namespace terrane

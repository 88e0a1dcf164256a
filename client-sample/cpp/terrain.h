// The terrain around a viewer, for a game: one object, one thread, polled once a frame.
//
//     auto terrain = Terrain::connect({.client = {.host = "127.0.0.1"}, .radius_chunks = {8, 8,
//     8}}); each frame:
//         terrain->look({.x = x, .y = y, .z = z});             // voxels; as often as you like
//         auto changes = terrain->poll(now + 2ms);             // error: the session has ended
//         for (auto& change : *changes) { ChunkReady: show its mesh; ChunkGone: drop it }
//
// The server sends what the view wants, most urgent first; this decodes it within the time that
// `poll` is given. In the form `columns` it is sent no meshes: it makes them itself (column_map.h),
// and every voxel near the viewer can be asked for. Columns come for the ground's inside too, where
// no mesh is: in all they are more bytes than the meshes. A chunk is meshed
// when its neighbours in the view have come. At the rim, where a neighbour is not in the view, the
// mesh is made without; it comes again, exact, when the neighbour enters the view.
#pragma once

#include "client-sample/cpp/client.h"
#include "client-sample/cpp/column_map.h"
#include "client-sample/cpp/view_set.h"
#include "generator/mesh/mesh.h"

#include <cstdint>
#include <memory>
#include <set>
#include <variant>
#include <vector>

namespace terrane {

enum class TerrainForm : std::uint8_t {
    draco,    ///< meshes from the server
    blocky,   ///< the same as blocks; level 0 only, so one radius
    columns,  ///< columns from the server, meshes made here
};

struct TerrainOptions {
    ClientOptions client;
    TerrainForm form = TerrainForm::columns;
    /// One a level from 0, in its chunk sides; the last one is the horizon.
    std::vector<std::uint32_t> radius_chunks = {6, 6, 6, 6};
};

/// Where the viewer is, in voxels of level 0, and what the server should be quick about.
struct Viewer {
    double x = 0;
    double y = 0;
    double z = 0;
    WireVector direction = {};  ///< zero: nowhere in particular
    WireVector velocity = {};   ///< voxels a second
    float field_of_view = 1.6F;
};

/// A chunk's mesh in place of any before it; without triangles if there is no surface. Positions
/// are 1/256 of the chunk's own columns (x, z) and voxels (y), from its corner: corner_of and
/// scale_of take them to the world.
struct ChunkReady {
    ChunkPos key;
    Mesh mesh;
};

/// Not in the view any more.
struct ChunkGone {
    ChunkPos key;
};

/// A Failure is about one chunk if it has a key, else about the last `look`.
using TerrainChange = std::variant<ChunkReady, ChunkGone, Failure>;

/// `poll` returns when it has so many.
inline constexpr std::size_t kChangesPerPollMax = 256;

class Terrain {
  public:
    /// Connects and greets. Fails like Client::connect, and with `unsupported` if the server gives
    /// no views.
    static Result<Terrain> connect(const TerrainOptions& options);

    const ServerHello& world() const { return client_.hello(); }

    /// What is to be seen from now on.
    Result<void> look(const Viewer& viewer);

    /// Takes what has come. Returns at the deadline, or as soon as something has changed and
    /// nothing more is at hand. Fails once the session is over.
    Result<std::vector<TerrainChange>> poll(Deadline deadline);

    /// All of the view has come.
    bool is_filled() const { return missing_ == 0 && has_looked_; }

    std::size_t missing() const { return missing_; }

    /// Something is to be meshed that has been held up by `poll`'s limits: poll again.
    bool has_work() const { return !to_look_at_.empty(); }

    /// What has come in the form `columns`; empty in others.
    const ColumnMap& columns() const { return columns_; }

    std::uint64_t received_bytes() const { return received_bytes_; }

    /// World metres of a chunk's corner, and of one of its mesh's units along each axis.
    struct Placement {
        double x_m = 0;
        double y_m = 0;
        double z_m = 0;
        double across_m = 0;   ///< x and z, for 1/256
        double upwards_m = 0;  ///< y, for 1/256
    };

    Placement placement_of(ChunkPos key) const;

  private:
    /// How far a held chunk is on the way to its mesh.
    enum class Meshed : std::uint8_t { no, at_the_rim, exactly };

    Terrain(Client client, const TerrainOptions& options);

    ChunkFormat format() const;

    bool is_wanted(ChunkPos key) const { return view_.contains(stack_of(key)); }

    Result<void> take(ClientEvent event, std::vector<TerrainChange>& changes);
    void take_chunk(const ReceivedChunk& chunk, std::vector<TerrainChange>& changes);
    void take_forget(const ChunkForget& forget, std::vector<TerrainChange>& changes);
    void mesh_if_ready(ChunkPos key, std::vector<TerrainChange>& changes);
    void mesh_around(ChunkPos key, std::vector<TerrainChange>& changes);

    Client client_;
    TerrainForm form_;
    std::vector<std::uint32_t> radius_chunks_;
    ColumnMap columns_;
    ViewSet view_;
    bool has_looked_ = false;
    std::set<ChunkPos> come_;
    std::map<ChunkPos, Meshed> meshed_;  ///< of the chunks that are held as columns
    std::vector<ChunkPos> to_look_at_;   ///< may be ready since the view has changed
    std::size_t missing_ = 0;
    std::uint64_t received_bytes_ = 0;
};

}  // namespace terrane

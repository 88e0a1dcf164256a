#include "storage/rocksdb_store.h"

#include "storage/record.h"
#include "storage/store_directory.h"
#include "tests/storage/temporary_folder.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <csignal>
#include <fstream>
#include <iterator>
#include <mutex>
#include <string>
#include <vector>

namespace terrane {
namespace {

namespace fs = std::filesystem;

using Opened = Result<std::unique_ptr<ChunkStore>>;

StoreIdentity identity(std::uint64_t fingerprint = 2, std::uint64_t content_id = 4) {
    return {.fingerprint = {.high = 1, .low = fingerprint},
            .content_id = {.high = 3, .low = content_id},
            .generator_version = 1,
            .world_name = "world " + std::to_string(fingerprint)};
}

RecordKey stack_at(std::int32_t x) {
    return {.family = Family::stacks, .position = {.lod = 0, .x = x, .y = 0, .z = 0}};
}

RecordKey mesh_at(std::int32_t x) {
    return {.family = Family::meshes, .format = 1, .position = {.lod = 0, .x = x, .y = 0, .z = 0}};
}

void put(ChunkStore& store, const RecordKey& key, std::string_view value) {
    const RecordToPut record{.key = key, .value = bytes_of(value)};
    const auto done = store.put(std::span(&record, 1));
    ASSERT_TRUE(done) << done.error().message;
}

/// Incompressible, so that every byte of it lies in the file.
std::string sample_value(std::int32_t x) {
    std::string out;
    Hash128 hash{.high = 0, .low = static_cast<std::uint64_t>(x)};
    while (out.size() < 4096) {
        hash = hash128(std::as_bytes(std::span(&hash, 1)));
        out += text_of(std::as_bytes(std::span(&hash, 1)));
    }
    return out;
}

std::string text(const Result<std::optional<Bytes>>& got) {
    if (!got) {
        return "error: " + got.error().message;
    }
    return *got ? std::string(text_of(**got)) : "nothing";
}

std::string read_file(const fs::path& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

void write_file(const fs::path& path, std::string_view bytes) {
    std::ofstream(path, std::ios::binary) << bytes;
}

class RocksdbStoreTest : public testing::Test {
  protected:
    Opened open(const StoreIdentity& wanted = identity()) {
        return open_rocksdb_store(data(), wanted, options());
    }

    RocksdbOptions options() {
        return {.on_notice = [this](std::string_view sentence) {
            const std::lock_guard lock(mutex_);
            notices_ += std::string(sentence) + "\n";
        }};
    }

    /// A closed store with stacks 0..99, small write buffers so that they lie in table files.
    void make_store() {
        RocksdbOptions small = options();
        small.write_buffer_bytes = std::size_t{128} << 10U;
        auto store = open_rocksdb_store(data(), identity(), small);
        ASSERT_TRUE(store) << store.error().message;
        for (std::int32_t x = 0; x < 100; ++x) {
            put(**store, stack_at(x), sample_value(x));
        }
        ASSERT_TRUE((*store)->flush());
    }

    fs::path data() const { return folder_.path() / "parent" / "data"; }

    fs::path database() const { return StoreDirectory{.root = data()}.database(); }

    std::string refusal(const Opened& opened, ErrorCode code) {
        if (opened) {
            return "was opened";
        }
        EXPECT_EQ(to_string(opened.error().code), to_string(code));
        return opened.error().message;
    }

    std::vector<fs::path> database_files(std::string_view extension) const {
        std::vector<fs::path> files;
        for (const auto& entry : fs::directory_iterator(database())) {
            if (entry.path().extension() == extension) {
                files.push_back(entry.path());
            }
        }
        std::sort(files.begin(), files.end());
        return files;
    }

    TemporaryFolder folder_;
    std::mutex mutex_;
    std::string notices_;
};

TEST_F(RocksdbStoreTest, KeepsRecordsFromOneOpeningToTheNext) {
    make_store();
    auto store = open();
    ASSERT_TRUE(store) << store.error().message;
    for (std::int32_t x = 0; x < 100; ++x) {
        ASSERT_EQ(text((*store)->get(stack_at(x))), sample_value(x));
    }
    EXPECT_EQ(notices_, "");
}

TEST_F(RocksdbStoreTest, TellsWhatTheDatabaseHolds) {
    std::uint64_t memtable_bytes = 0;
    {
        const auto store = open();
        ASSERT_TRUE(store);
        const std::uint64_t empty = (*store)->stats().memtable_bytes;
        for (std::int32_t x = 0; x < 100; ++x) {
            put(**store, stack_at(x), sample_value(x));
        }
        memtable_bytes = (*store)->stats().memtable_bytes;
        EXPECT_GE(memtable_bytes, empty + 400'000);
        EXPECT_EQ((*store)->stats().stalled_writes, 0U);
    }
    const auto again = open();
    ASSERT_TRUE(again);
    EXPECT_EQ(text((*again)->get(stack_at(5))), sample_value(5));
    const StoreStats stats = (*again)->stats();
    EXPECT_LT(stats.memtable_bytes, memtable_bytes) << "tables now";
    EXPECT_GE(stats.disk_bytes, 400'000U);
    EXPECT_GT(stats.block_cache_bytes, 0U);
}

TEST_F(RocksdbStoreTest, RefusesAnotherWorldNamesBothAndKeepsTheRecords) {
    make_store();
    const std::string message = refusal(open(identity(77)), ErrorCode::wrong_world);
    EXPECT_NE(message.find("'world 2'"), std::string::npos) << message;
    EXPECT_NE(message.find("'world 77'"), std::string::npos) << message;
    EXPECT_NE(message.find(data().string()), std::string::npos) << message;
    EXPECT_NE(message.find("use another --data directory or remove this one"), std::string::npos);
    auto store = open();
    ASSERT_TRUE(store);
    EXPECT_EQ(text((*store)->get(stack_at(5))), sample_value(5));
}

TEST_F(RocksdbStoreTest, KeepsStacksAndIgnoresMeshesOfAnotherEncoding) {
    {
        auto store = open();
        ASSERT_TRUE(store);
        put(**store, stack_at(1), "stack");
        put(**store, mesh_at(1), "mesh");
    }
    auto store = open(identity(2, 5));
    ASSERT_TRUE(store) << store.error().message;
    EXPECT_EQ(text((*store)->get(stack_at(1))), "stack");
    EXPECT_EQ(text((*store)->get(mesh_at(1))), "nothing");
}

TEST_F(RocksdbStoreTest, RefusesANewerFormat) {
    make_store();
    const std::string begin = "Terrane store, format 2";
    write_file(data() / "TERRANE_STORE",
               begin + ", checksum " + to_hex(hash128(bytes_of(begin))) + "\nmore to come\n");
    const std::string message = refusal(open(), ErrorCode::version_mismatch);
    EXPECT_NE(message.find("format 2 is newer"), std::string::npos) << message;
    EXPECT_NE(message.find("another --data directory"), std::string::npos) << message;
}

TEST_F(RocksdbStoreTest, WritesADamagedMarkerAnew) {
    make_store();
    const std::string marker = read_file(data() / "TERRANE_STORE");
    for (const std::string& damaged : {std::string(), std::string("Terrane store, format 9"),
                                       marker.substr(0, marker.size() / 2)}) {
        write_file(data() / "TERRANE_STORE", damaged);
        auto store = open();
        ASSERT_TRUE(store) << store.error().message;
        EXPECT_EQ(text((*store)->get(stack_at(5))), sample_value(5));
        EXPECT_EQ(read_file(data() / "TERRANE_STORE"), marker);
    }
}

TEST_F(RocksdbStoreTest, RefusesADirectoryOfSomethingElseAndLeavesItAlone) {
    fs::create_directories(data());
    write_file(data() / "letters.txt", "dear all");
    const std::string message = refusal(open(), ErrorCode::invalid_argument);
    EXPECT_NE(message.find("not a Terrane store"), std::string::npos) << message;
    EXPECT_EQ(std::distance(fs::directory_iterator(data()), fs::directory_iterator()), 1);
    EXPECT_EQ(read_file(data() / "letters.txt"), "dear all");
}

TEST_F(RocksdbStoreTest, RefusesAFileInPlaceOfADirectory) {
    fs::create_directories(data().parent_path());
    write_file(data(), "a file");
    const std::string message = refusal(open(), ErrorCode::io_error);
    EXPECT_NE(message.find("is not a directory"), std::string::npos) << message;
    EXPECT_EQ(read_file(data()), "a file");
}

TEST_F(RocksdbStoreTest, RefusesAPathThatCannotBeMade) {
    write_file(folder_.path() / "parent", "a file");
    const std::string message = refusal(open(), ErrorCode::io_error);
    EXPECT_NE(message.find(data().string()), std::string::npos) << message;
}

TEST_F(RocksdbStoreTest, RefusesADirectoryItCannotWrite) {
    const auto opened = open_rocksdb_store("/proc/terrane", identity(), options());
    const std::string message = refusal(opened, ErrorCode::io_error);
    EXPECT_NE(message.find("/proc/terrane"), std::string::npos) << message;
}

TEST_F(RocksdbStoreTest, RefusesADirectoryInUse) {
    auto first = open();
    ASSERT_TRUE(first);
    const std::string message = refusal(open(), ErrorCode::io_error);
    EXPECT_NE(message.find("in use by another terrane"), std::string::npos) << message;
    put(**first, stack_at(1), "still here");
    EXPECT_EQ(text((*first)->get(stack_at(1))), "still here");
    EXPECT_FALSE(fs::exists(StoreDirectory{.root = data()}.damaged_database()));
}

TEST_F(RocksdbStoreTest, FindsADamagedRecordCountsItAndTakesANewOne) {
    make_store();
    const auto tables = database_files(".sst");
    ASSERT_FALSE(tables.empty());
    const std::string wanted = sample_value(10).substr(1000, 64);
    bool flipped = false;
    for (const fs::path& table : tables) {
        std::string bytes = read_file(table);
        if (const std::size_t at = bytes.find(wanted); at != std::string::npos) {
            bytes[at] = static_cast<char>(bytes[at] ^ 1);
            write_file(table, bytes);
            flipped = true;
        }
    }
    ASSERT_TRUE(flipped) << "the record is not in a table file";
    auto store = open();
    ASSERT_TRUE(store) << store.error().message;
    EXPECT_EQ(text((*store)->get(stack_at(10))), "nothing");
    EXPECT_EQ((*store)->stats().corrupt, 1U);
    EXPECT_EQ((*store)->stats().failures, 0U);
    EXPECT_EQ(text((*store)->get(stack_at(90))), sample_value(90)) << "the rest is whole";
    put(**store, stack_at(10), "made anew");
    EXPECT_EQ(text((*store)->get(stack_at(10))), "made anew");
}

TEST_F(RocksdbStoreTest, SetsADatabasePastRepairAsideAndBeginsANewOne) {
    make_store();
    for (int round = 0; round < 2; ++round) {
        const auto current = database() / "CURRENT";
        ASSERT_TRUE(fs::exists(current));
        for (const auto& entry : fs::directory_iterator(database())) {
            if (entry.path().filename().string().starts_with("MANIFEST")) {
                write_file(entry.path(), "these are not the bytes you wrote");
            }
        }
        notices_.clear();
        auto store = open();
        ASSERT_TRUE(store) << store.error().message;
        EXPECT_NE(notices_.find("set aside as " + (data() / "rocksdb.damaged").string()),
                  std::string::npos)
            << notices_;
        EXPECT_EQ(text((*store)->get(stack_at(5))), "nothing");
        put(**store, stack_at(5), "made anew");
        EXPECT_EQ(text((*store)->get(stack_at(5))), "made anew");
        store->reset();
        EXPECT_EQ(std::distance(fs::directory_iterator(data()), fs::directory_iterator()), 3)
            << "one marker, one database, one damaged database";
    }
}

TEST_F(RocksdbStoreTest, SetsASideADatabaseNotedAsDamaged) {
    make_store();
    write_file(StoreDirectory{.root = data()}.damage_note(), "block checksum mismatch");
    auto store = open();
    ASSERT_TRUE(store) << store.error().message;
    EXPECT_NE(notices_.find("found damaged while in use"), std::string::npos) << notices_;
    EXPECT_EQ(text((*store)->get(stack_at(5))), "nothing");
    EXPECT_FALSE(fs::exists(StoreDirectory{.root = data()}.damage_note()));
}

// Whatever file of the database is damaged, and however: the store opens or is begun anew, and what
// it answers is right or missing.
TEST_F(RocksdbStoreTest, SurvivesDamageToAnyFile) {
    make_store();
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(database())) {
        if (entry.file_size() > 0) {
            names.push_back(entry.path().filename().string());
        }
    }
    ASSERT_GE(names.size(), 5U);
    const fs::path original = folder_.path() / "original";
    fs::rename(data(), original);
    for (const std::string& name : names) {
        for (const std::string damage : {"removed", "emptied", "halved", "flipped"}) {
            SCOPED_TRACE(name + " " + damage);
            fs::remove_all(data());
            fs::copy(original, data(), fs::copy_options::recursive);
            const fs::path file = database() / name;
            std::string bytes = read_file(file);
            bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 0x55);
            if (damage == "removed") {
                fs::remove(file);
            } else {
                write_file(file, damage == "emptied"  ? ""
                                 : damage == "halved" ? bytes.substr(0, bytes.size() / 2)
                                                      : bytes);
            }
            auto store = open();
            ASSERT_TRUE(store) << store.error().message;
            for (std::int32_t x = 0; x < 100; ++x) {
                const std::string got = text((*store)->get(stack_at(x)));
                ASSERT_TRUE(got == "nothing" || got == sample_value(x)) << x << ": " << got;
            }
            put(**store, stack_at(7), "made anew");
            EXPECT_EQ(text((*store)->get(stack_at(7))), "made anew");
        }
    }
}

// A killed process leaves a log whose end may be torn at any byte: what is there is right, in
// order.
TEST_F(RocksdbStoreTest, OpensWithItsLogCutAnywhere) {
    {
        auto store = open();
        ASSERT_TRUE(store);
        for (std::int32_t x = 0; x < 8; ++x) {
            put(**store, stack_at(x), "value " + std::to_string(x));
        }
        ASSERT_TRUE((*store)->flush());
        fs::copy(data(), folder_.path() / "original", fs::copy_options::recursive);
    }
    const fs::path original = folder_.path() / "original";
    fs::path log;
    for (const auto& entry : fs::directory_iterator(original / "rocksdb")) {
        if (entry.path().extension() == ".log" && entry.file_size() > 0) {
            log = entry.path();
        }
    }
    ASSERT_FALSE(log.empty());
    const std::string whole = read_file(log);
    for (std::size_t size = 0; size <= whole.size(); size += 23) {
        fs::remove_all(data());
        fs::copy(original, data(), fs::copy_options::recursive);
        write_file(database() / log.filename(), std::string_view(whole).substr(0, size));
        auto store = open();
        ASSERT_TRUE(store) << store.error().message;
        bool ended = false;
        for (std::int32_t x = 0; x < 8; ++x) {
            const std::string got = text((*store)->get(stack_at(x)));
            ASSERT_TRUE(got == "nothing" || got == "value " + std::to_string(x)) << got;
            EXPECT_FALSE(ended && got != "nothing") << "a later record outlived an earlier one";
            ended = ended || got == "nothing";
        }
    }
}

// A note of damage makes the next opening move the database: not while somebody has it open.
TEST_F(RocksdbStoreTest, StaysWhereItIsWhileInUse) {
    auto store = open();
    ASSERT_TRUE(store);
    put(**store, stack_at(1), "kept");
    write_file(database() / "TERRANE_DAMAGED", "for a test");
    const auto second = open();
    ASSERT_FALSE(second);
    EXPECT_NE(second.error().message.find("in use by another terrane"), std::string::npos);
    EXPECT_FALSE(fs::exists(data() / "rocksdb.damaged"));
    EXPECT_EQ(text((*store)->get(stack_at(1))), "kept");
}

// Files that may not grow stand for a full disk: the log's write fails the same way.
TEST_F(RocksdbStoreTest, OutlivesAFailedWriteAndKeepsWhatItTook) {
    std::signal(SIGXFSZ, SIG_IGN);
    rlimit limit{};
    ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &limit), 0);
    std::int32_t taken = 0;
    {
        auto store = open();
        ASSERT_TRUE(store);
        rlimit small = limit;
        small.rlim_cur = rlim_t{1} << 20U;
        ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
        const Bytes value(100'000, std::byte{7});
        const auto put_one = [&](std::int32_t x) {
            const RecordToPut record{.key = stack_at(x), .value = value};
            return (*store)->put(std::span(&record, 1));
        };
        while (taken < 100 && put_one(taken)) {
            ++taken;
        }
        ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &limit), 0);
        ASSERT_TRUE(taken > 0 && taken < 100) << taken;
        EXPECT_FALSE(put_one(taken)) << "nothing more is written, even if there is room again";
        EXPECT_FALSE((*store)->flush());
        const auto read = (*store)->get(stack_at(0));
        ASSERT_TRUE(read && *read);
        EXPECT_EQ(**read, value);
    }
    // The broken database is still open in this process; a copy is what the next one finds.
    fs::copy(data(), folder_.path() / "copy", fs::copy_options::recursive);
    const auto again = open_rocksdb_store(folder_.path() / "copy", identity());
    ASSERT_TRUE(again) << again.error().message;
    for (std::int32_t x = 0; x < taken; ++x) {
        const auto read = (*again)->get(stack_at(x));
        EXPECT_TRUE(read && *read) << x;
    }
}

}  // namespace
}  // namespace terrane

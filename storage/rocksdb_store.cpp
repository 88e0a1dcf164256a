#include "storage/rocksdb_store.h"

#include "protocol/base/bytes.h"
#include "protocol/base/check.h"
#include "protocol/base/mutex.h"
#include "protocol/base/result.h"
#include "storage/chunk_store.h"
#include "storage/record.h"
#include "storage/store_directory.h"

#include <rocksdb/cache.h>
#include <rocksdb/db.h>
#include <rocksdb/filter_policy.h>
#include <rocksdb/listener.h>
#include <rocksdb/options.h>
#include <rocksdb/table.h>
#include <rocksdb/write_batch.h>

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

namespace terrane {
namespace {

constexpr int kOpenFilesMax = 512;
constexpr int kBackgroundJobsMax = 2;
constexpr std::size_t kLogFilesMax = 2;
constexpr std::size_t kLogFileBytesMax = std::size_t{1} << 20U;
constexpr std::uint64_t kWriteAheadLogBytesMax = std::uint64_t{128} << 20U;
constexpr std::size_t kBlockBytes = std::size_t{16} << 10U;
constexpr double kBloomBitsPerKey = 10;

// Order of the column families everywhere below; RocksDB insists on `default`, which stays empty.
enum FamilyIndex : std::uint8_t { family_default, family_stacks, family_meshes, family_metadata };

constexpr std::array<const char*, 4> kFamilyNames = {"default", "stacks", "meshes", "metadata"};

void tell(const RocksdbOptions& options, const std::string& sentence) {
    if (options.on_notice) {
        options.on_notice(sentence);
    } else {
        std::fprintf(stderr, "terrane: %s\n", sentence.c_str());
    }
}

rocksdb::Slice slice_of(std::span<const std::byte> bytes) {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::span<const std::byte> bytes_of_slice(const rocksdb::Slice& slice) {
    return bytes_of({slice.data(), slice.size()});
}

/// Counts what goes wrong behind the callers' backs, and leaves a note when a file turns out
/// damaged: RocksDB takes no more writes then, so the next opening has to begin anew.
class BackgroundErrors final : public rocksdb::EventListener {
  public:
    BackgroundErrors(StoreDirectory directory, RocksdbOptions options)
        : directory_(std::move(directory)), options_(std::move(options)) {}

    void OnBackgroundError(rocksdb::BackgroundErrorReason /*reason*/,
                           rocksdb::Status* status) override {
        ++count_;
        const MutexLock lock(mutex_);
        if (silent_) {
            return;
        }
        std::string sentence = directory_.root.string() +
                               ": writing failed in the background: " + status->ToString() +
                               "; serving goes on, nothing more is stored";
        if (status->IsCorruption()) {
            std::ofstream(directory_.damage_note()) << status->ToString() << "\n";
            sentence += " until the next start sets the damaged database aside";
        }
        tell(options_, sentence);
    }

    std::uint64_t count() const { return count_; }

    /// From now on nothing is told: who listens may be gone.
    void silence() {
        const MutexLock lock(mutex_);
        silent_ = true;
    }

  private:
    const StoreDirectory directory_;
    const RocksdbOptions options_;
    Mutex mutex_;
    bool silent_ TERRANE_GUARDED_BY(mutex_) = false;
    std::atomic<std::uint64_t> count_ = 0;
};

/// Holds what is not to be destroyed, so that it is no leak in the eyes of a leak checker.
void keep_for_ever(rocksdb::DB* db, std::vector<rocksdb::ColumnFamilyHandle*> families) {
    struct Kept {
        rocksdb::DB* db;
        std::vector<rocksdb::ColumnFamilyHandle*> families;
    };

    static Mutex mutex;
    static auto* const kKept = new std::vector<Kept>;
    const MutexLock lock(mutex);
    kKept->push_back({.db = db, .families = std::move(families)});
}

/// An open database; closes column families before it.
///
/// After a failed write it is never closed: RocksDB's writer of the log asserts in its destructor
/// that what it took was flushed, which on a full disk ends the whole program. What was
/// acknowledged is in the log and found again when a later process opens the database.
struct Database {
    std::unique_ptr<rocksdb::DB> db;
    std::vector<rocksdb::ColumnFamilyHandle*> families;
    std::shared_ptr<BackgroundErrors> errors;
    std::atomic<bool> writing_failed = false;

    Database() = default;
    Database(const Database&) = delete;
    Database& operator=(const Database&) = delete;

    bool is_broken() const { return writing_failed || (errors && errors->count() > 0); }

    ~Database() {
        if (errors) {
            errors->silence();
        }
        if (db && is_broken()) {
            keep_for_ever(db.release(), std::move(families));
            return;
        }
        for (rocksdb::ColumnFamilyHandle* family : families) {
            db->DestroyColumnFamilyHandle(family);
        }
    }
};

/// Less free space than this is no place to begin work: RocksDB ends the program when its first
/// files do not fit. The tables made of the logs that are read back come on top.
constexpr std::uint64_t kFreeBytesMin = std::uint64_t{16} << 20U;

Result<void> check_free_space(const StoreDirectory& directory) {
    std::uint64_t needed_bytes = kFreeBytesMin;
    std::error_code error;
    std::filesystem::directory_iterator entries(directory.database(), error);
    for (; !error && entries != std::filesystem::directory_iterator(); entries.increment(error)) {
        if (entries->path().extension() == ".log") {
            std::error_code unknown;
            const auto size_bytes = entries->file_size(unknown);
            needed_bytes += unknown ? 0 : size_bytes;
        }
    }
    const auto space = std::filesystem::space(directory.root, error);
    if (!error && space.available < needed_bytes) {
        return fail(ErrorCode::io_error,
                    directory.root.string() +
                        ": the disk is full: " + std::to_string(space.available >> 20U) +
                        " MiB are free and " + std::to_string((needed_bytes >> 20U) + 1) +
                        " are needed; make room or use another --data directory");
    }
    return {};
}

rocksdb::DBOptions database_options(const RocksdbOptions& options) {
    rocksdb::DBOptions out;
    out.create_missing_column_families = true;
    out.max_open_files = kOpenFilesMax;
    out.max_background_jobs = kBackgroundJobsMax;
    out.db_write_buffer_size = options.write_buffer_bytes;
    out.max_total_wal_size = kWriteAheadLogBytesMax;
    out.keep_log_file_num = kLogFilesMax;
    out.max_log_file_size = kLogFileBytesMax;
    out.info_log_level = rocksdb::InfoLogLevel::WARN_LEVEL;
    out.stats_dump_period_sec = 0;
    out.bytes_per_sync = std::uint64_t{1} << 20U;
    // Records check themselves and can be made again: one bad log entry costs that record only.
    out.wal_recovery_mode = rocksdb::WALRecoveryMode::kSkipAnyCorruptedRecords;
    return out;
}

rocksdb::ColumnFamilyOptions family_options(const RocksdbOptions& options,
                                            const std::shared_ptr<rocksdb::Cache>& cache) {
    rocksdb::BlockBasedTableOptions table;
    table.block_cache = cache;
    table.block_size = kBlockBytes;
    table.cache_index_and_filter_blocks = true;
    table.pin_l0_filter_and_index_blocks_in_cache = true;
    table.filter_policy.reset(rocksdb::NewBloomFilterPolicy(kBloomBitsPerKey));
    table.format_version = 5;
    rocksdb::ColumnFamilyOptions out;
    out.table_factory.reset(rocksdb::NewBlockBasedTableFactory(table));
    out.write_buffer_size = options.write_buffer_bytes / 2;
    out.compression = rocksdb::kZSTD;
    return out;
}

rocksdb::Status open_database(Database& out, const StoreDirectory& directory, bool create,
                              const RocksdbOptions& options) {
    out.errors = std::make_shared<BackgroundErrors>(directory, options);
    rocksdb::DBOptions settings = database_options(options);
    settings.create_if_missing = create;
    settings.listeners.push_back(out.errors);
    const auto cache = rocksdb::NewLRUCache(options.block_cache_bytes);
    std::vector<rocksdb::ColumnFamilyDescriptor> families;
    families.reserve(kFamilyNames.size());
    for (const char* name : kFamilyNames) {
        families.emplace_back(name, family_options(options, cache));
    }
    rocksdb::DB* db = nullptr;
    const rocksdb::Status status =
        rocksdb::DB::Open(settings, directory.database().string(), families, &out.families, &db);
    out.db.reset(db);
    return status;
}

/// Is this a database that will never open again, rather than a disk that refuses us now?
bool is_past_repair(const rocksdb::Status& status) {
    return status.IsCorruption() || status.IsPathNotFound() || status.IsNotFound() ||
           (status.IsInvalidArgument() &&
            status.ToString().find("create_if_missing is false") != std::string::npos);
}

tl::unexpected<Error> opening_failure(const StoreDirectory& directory,
                                      const rocksdb::Status& status) {
    const std::string text = status.ToString();
    const bool locked = text.find("lock hold by current process") != std::string::npos ||
                        text.find("Resource temporarily unavailable") != std::string::npos;
    if (locked) {
        return fail(ErrorCode::io_error,
                    directory.root.string() +
                        ": is in use by another terrane; stop that one or use another --data "
                        "directory");
    }
    return fail(ErrorCode::io_error, directory.root.string() + ": cannot be opened: " + text +
                                         "; check its permissions and the space left, or use "
                                         "another --data directory");
}

/// Opens what is there, or begins a new database where there is none or only a damaged one.
Result<void> open_or_rebuild(Database& out, const StoreDirectory& directory,
                             const RocksdbOptions& options) {
    const auto absent = is_database_absent(directory);
    if (!absent) {
        return tl::unexpected(absent.error());
    }
    std::error_code error;
    std::string damage;
    if (std::filesystem::exists(directory.damage_note(), error)) {
        damage = "was found damaged while in use";
    } else {
        const rocksdb::Status status = open_database(out, directory, *absent, options);
        if (status.ok()) {
            return {};
        }
        if (*absent || !is_past_repair(status)) {
            return opening_failure(directory, status);
        }
        damage = "is damaged (" + status.ToString() + ")";
    }
    if (const auto aside = set_database_aside(directory); !aside) {
        return aside;
    }
    tell(options, directory.database().string() + ": " + damage + "; it was set aside as " +
                      directory.damaged_database().string() +
                      " and a new one begun; everything in it will be made again");
    const rocksdb::Status status = open_database(out, directory, true, options);
    return status.ok() ? Result<void>() : opening_failure(directory, status);
}

/// Compares the database's metadata with what is wanted, and writes what is wanted.
Result<void> claim(Database& database, const StoreDirectory& directory,
                   const StoreIdentity& identity) {
    rocksdb::ColumnFamilyHandle* family = database.families[family_metadata];
    const rocksdb::Slice key(kMetadataKey.data(), kMetadataKey.size());
    std::string stored;
    const rocksdb::Status status = database.db->Get(rocksdb::ReadOptions(), family, key, &stored);
    if (!status.ok() && !status.IsNotFound()) {
        return fail(status.IsCorruption() ? ErrorCode::corrupt : ErrorCode::io_error,
                    directory.root.string() + ": metadata cannot be read: " + status.ToString());
    }
    if (status.ok()) {
        const auto metadata = decode_metadata(bytes_of(stored));
        if (!metadata) {
            return fail(metadata.error().code,
                        directory.root.string() + ": " + metadata.error().message +
                            "; use a newer terrane, another --data directory, or remove this one");
        }
        if (auto same = check_identity(metadata->identity, identity, directory.root.string());
            !same) {
            return same;
        }
    }
    Bytes wanted;
    encode_metadata(wanted, {.format = kStoreFormat, .identity = identity});
    rocksdb::WriteOptions durable;
    durable.sync = true;
    if (slice_of(wanted) != rocksdb::Slice(stored)) {
        const rocksdb::Status written = database.db->Put(durable, family, key, slice_of(wanted));
        if (!written.ok()) {
            database.writing_failed = true;
            return opening_failure(directory, written);
        }
    }
    return {};
}

class RocksdbStore final : public ChunkStore {
  public:
    RocksdbStore(StoreDirectory directory, StoreIdentity identity, DirectoryLock lock,
                 std::unique_ptr<Database> database)
        : directory_(std::move(directory)),
          lock_(std::move(lock)),
          identity_(std::move(identity)),
          database_(std::move(database)) {}

    Result<std::optional<Bytes>> get(const RecordKey& key) override {
        const std::string encoded = encode_key(identity_, key);
        rocksdb::PinnableSlice value;
        const rocksdb::Status status =
            database_->db->Get(rocksdb::ReadOptions(), family_of(key), encoded, &value);
        return answer(encoded, status, value);
    }

    Result<std::vector<std::optional<Bytes>>> get_many(std::span<const RecordKey> keys) override {
        std::vector<std::string> encoded;
        std::vector<rocksdb::ColumnFamilyHandle*> families;
        for (const RecordKey& key : keys) {
            encoded.push_back(encode_key(identity_, key));
            families.push_back(family_of(key));
        }
        const std::vector<rocksdb::Slice> slices(encoded.begin(), encoded.end());
        std::vector<rocksdb::PinnableSlice> values(keys.size());
        std::vector<rocksdb::Status> statuses(keys.size());
        database_->db->MultiGet(rocksdb::ReadOptions(), keys.size(), families.data(), slices.data(),
                                values.data(), statuses.data());
        std::vector<std::optional<Bytes>> out;
        out.reserve(keys.size());
        for (std::size_t i = 0; i < keys.size(); ++i) {
            auto value = answer(encoded[i], statuses[i], values[i]);
            if (!value) {
                return tl::unexpected(value.error());
            }
            out.push_back(std::move(*value));
        }
        return out;
    }

    Result<void> put(std::span<const RecordToPut> records) override {
        if (database_->is_broken()) {
            return no_more_writing();
        }
        rocksdb::WriteBatch batch;
        Bytes framed;
        for (const RecordToPut& record : records) {
            const std::string key = encode_key(identity_, record.key);
            frame_value(framed, key, record.value);
            const rocksdb::Status status = batch.Put(family_of(record.key), key, slice_of(framed));
            TERRANE_ASSERT(status.ok());
        }
        auto written =
            written_or_broken(database_->db->Write(rocksdb::WriteOptions(), &batch), "write");
        if (written) {
            puts_ += records.size();
        }
        return written;
    }

    Result<void> erase(const RecordKey& key) override {
        if (database_->is_broken()) {
            return no_more_writing();
        }
        return written_or_broken(database_->db->Delete(rocksdb::WriteOptions(), family_of(key),
                                                       encode_key(identity_, key)),
                                 "erase");
    }

    Result<void> flush() override {
        if (database_->is_broken()) {
            return no_more_writing();
        }
        return written_or_broken(database_->db->SyncWAL(), "flush");
    }

    StoreStats stats() const override {
        using Properties = rocksdb::DB::Properties;
        const std::uint64_t delay = property(Properties::kActualDelayedWriteRate);
        const std::uint64_t stop = property(Properties::kIsWriteStopped);
        return {.gets = gets_,
                .hits = hits_,
                .puts = puts_,
                .corrupt = corrupt_,
                .failures = failures_ + database_->errors->count(),
                .disk_bytes = property(Properties::kTotalSstFilesSize),
                .memtable_bytes = property(Properties::kCurSizeAllMemTables),
                .block_cache_bytes =
                    property_of(*database_->families[family_stacks], Properties::kBlockCacheUsage),
                .pending_compaction_bytes = property(Properties::kEstimatePendingCompactionBytes),
                .stalled_writes = delay > 0 || stop > 0 ? 1U : 0U};
    }

  private:
    std::uint64_t property_of(rocksdb::ColumnFamilyHandle& family, const std::string& name) const {
        std::uint64_t value = 0;
        database_->db->GetIntProperty(&family, name, &value);
        return value;
    }

    /// The sum over all column families.
    std::uint64_t property(const std::string& name) const {
        std::uint64_t value = 0;
        database_->db->GetAggregatedIntProperty(name, &value);
        return value;
    }

    rocksdb::ColumnFamilyHandle* family_of(const RecordKey& key) const {
        return database_->families[key.family == Family::stacks ? family_stacks : family_meshes];
    }

    /// What a reader gets to see of one lookup: damage is a miss, a refusing disk an error.
    Result<std::optional<Bytes>> answer(const std::string& key, const rocksdb::Status& status,
                                        const rocksdb::Slice& framed) {
        ++gets_;
        if (status.IsNotFound()) {
            return std::nullopt;
        }
        if (!status.ok() && !status.IsCorruption()) {
            ++failures_;
            return fail(ErrorCode::io_error,
                        directory_.root.string() + ": reading failed: " + status.ToString());
        }
        if (status.ok()) {
            if (const auto value = unframe_value(key, bytes_of_slice(framed))) {
                ++hits_;
                return Bytes(value->begin(), value->end());
            }
        }
        ++corrupt_;
        return std::nullopt;
    }

    /// After the first failure nothing is written any more: see Database.
    Result<void> written_or_broken(const rocksdb::Status& status, const char* what) {
        if (status.ok()) {
            return {};
        }
        database_->writing_failed = true;
        ++failures_;
        return fail(ErrorCode::io_error, directory_.root.string() + ": " + what +
                                             " failed: " + status.ToString() +
                                             "; nothing more is stored until the next start");
    }

    Result<void> no_more_writing() {
        ++failures_;
        return fail(ErrorCode::io_error, directory_.root.string() +
                                             ": nothing is stored any more since a write failed; "
                                             "make room and start again");
    }

    const StoreDirectory directory_;
    const DirectoryLock lock_;  // let go after the database is closed
    const StoreIdentity identity_;
    const std::unique_ptr<Database> database_;
    std::atomic<std::uint64_t> gets_ = 0;
    std::atomic<std::uint64_t> hits_ = 0;
    std::atomic<std::uint64_t> puts_ = 0;
    std::atomic<std::uint64_t> corrupt_ = 0;
    std::atomic<std::uint64_t> failures_ = 0;
};

}  // namespace

Result<std::unique_ptr<ChunkStore>> open_rocksdb_store(const std::filesystem::path& directory,
                                                       const StoreIdentity& identity,
                                                       const RocksdbOptions& options) {
    const auto prepared = prepare_store_directory(directory);
    if (!prepared) {
        return tl::unexpected(prepared.error());
    }
    // Before anything is moved: a database in use must stay where it is.
    auto lock = DirectoryLock::take(*prepared);
    if (!lock) {
        return tl::unexpected(lock.error());
    }
    if (const auto room = check_free_space(*prepared); !room) {
        return tl::unexpected(room.error());
    }
    auto database = std::make_unique<Database>();
    if (const auto opened = open_or_rebuild(*database, *prepared, options); !opened) {
        return tl::unexpected(opened.error());
    }
    auto claimed = claim(*database, *prepared, identity);
    if (!claimed && claimed.error().code == ErrorCode::corrupt) {
        // Whose records these are can't be told any more, so they are nobody's.
        database = std::make_unique<Database>();
        if (const auto aside = set_database_aside(*prepared); !aside) {
            return tl::unexpected(aside.error());
        }
        tell(options, claimed.error().message + "; the database was set aside as " +
                          prepared->damaged_database().string() + " and a new one begun");
        if (const auto opened = open_or_rebuild(*database, *prepared, options); !opened) {
            return tl::unexpected(opened.error());
        }
        claimed = claim(*database, *prepared, identity);
    }
    if (!claimed) {
        return tl::unexpected(claimed.error());
    }
    return std::make_unique<RocksdbStore>(*prepared, identity, *std::move(lock),
                                          std::move(database));
}

}  // namespace terrane

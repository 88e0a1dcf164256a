// Where predictions fail: the few values that are stored because they are not what was predicted.
#pragma once

#include "protocol/base/bytes.h"

#include <cstddef>
#include <cstdint>
#include <optional>

namespace terrane {

/// What was predicted otherwise than it is: (cells since the last one, value) pairs.
class Exceptions {
  public:
    void agree(std::size_t cells) { since_ += cells; }

    void add(std::uint64_t value) {
        ++count_;
        ByteWriter(bytes_).varint(since_);
        ByteWriter(bytes_).varint(value);
        since_ = 0;
    }

    /// Keeps the memory.
    void clear() {
        bytes_.clear();
        count_ = since_ = 0;
    }

    void append_to(Bytes& out) const {
        ByteWriter(out).varint(count_);
        ByteWriter(out).raw(bytes_);
    }

  private:
    Bytes bytes_;
    std::size_t count_ = 0;
    std::size_t since_ = 0;
};

/// Reads them back while the cells are walked in the same order.
class ExceptionReader {
  public:
    explicit ExceptionReader(ByteReader& in) : in_(in) {
        const auto count = in.varint();
        left_ = count.value_or(0);
        ok_ = count.has_value();
        load();
    }

    /// Steps over so many cells if none of them is an exception.
    bool skip(std::size_t cells) {
        if (pending_ && until_ < cells) {
            return false;
        }
        until_ -= cells;
        return true;
    }

    /// The value that replaces the prediction of this cell, if any.
    std::optional<std::uint64_t> next() {
        if (!pending_ || until_ != 0) {
            --until_;
            return std::nullopt;
        }
        const std::uint64_t value = value_;
        load();
        return value;
    }

    /// All read, and the bytes were not cut short.
    bool finished() const { return ok_ && left_ == 0 && !pending_; }

  private:
    void load() {
        pending_ = false;
        if (!ok_ || left_ == 0) {
            return;
        }
        const auto until = in_.varint();
        const auto value = in_.varint();
        if (!until || !value) {
            ok_ = false;
            return;
        }
        --left_;
        until_ = *until;
        value_ = *value;
        pending_ = true;
    }

    ByteReader& in_;
    std::uint64_t left_ = 0;
    bool ok_ = false;
    bool pending_ = false;
    std::uint64_t until_ = 0;
    std::uint64_t value_ = 0;
};

}  // namespace terrane

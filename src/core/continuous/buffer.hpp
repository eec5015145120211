// Arrays whose length changes from slice to slice and from frame to frame.
#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

namespace ball_sim::core::continuous {

/// A vector that does not double when it grows, and that gives back what it has not used for long.
/// Values that are taken off, or not set after resize(), keep what they were.
template <class T>
class Buffer {
 public:
  using value_type = T;

  T* begin() { return room_.data(); }
  T* end() { return room_.data() + size_; }
  const T* begin() const { return room_.data(); }
  const T* end() const { return room_.data() + size_; }
  T& operator[](std::size_t i) { return room_[i]; }
  const T& operator[](std::size_t i) const { return room_[i]; }
  const T& front() const { return room_.front(); }
  T& back() { return room_[size_ - 1]; }
  bool empty() const { return size_ == 0; }
  std::size_t size() const { return size_; }
  std::size_t capacity() const { return room_.capacity(); }

  void push_back(const T& value) {
    if (size_ == room_.size()) grow(size_ + 1);
    room_[size_++] = value;
  }
  void pop_back() { resize(size_ - 1); }

  void append(const Buffer& other) {
    const std::size_t before = size_;
    resize(size_ + other.size_);
    std::copy(other.begin(), other.end(), begin() + before);
  }

  void resize(std::size_t size) {
    most_ = std::max(most_, size_);
    if (size > room_.size()) grow(size);
    size_ = size;
  }
  void clear() { resize(0); }

  void swap(Buffer& other) { std::swap(*this, other); }

  /// Keeps room for as many as there have been since the last call, and a few more. Where there is
  /// little too much nothing is done: what has settled is allocated no more.
  void giveBackRoom() {
    const std::size_t most = std::max(most_, size_);
    most_ = 0;
    if (room_.size() > most + most / 2 + kFew) makeRoom(most + most / 8);
  }

 private:
  static constexpr std::size_t kFew = 4096 / sizeof(T);

  // Rare, so it is kept out of the callers' code.
  __attribute__((noinline)) void grow(std::size_t size) { makeRoom(size + size / 8 + 1); }

  void makeRoom(std::size_t size) {
    std::vector<T> room(size);
    std::copy(begin(), end(), room.begin());
    room_.swap(room);
  }

  std::vector<T> room_;
  std::size_t size_ = 0;  // values, of those that there is room for
  std::size_t most_ = 0;  // values, seen before they became fewer
};

}  // namespace ball_sim::core::continuous

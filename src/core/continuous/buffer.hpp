// Arrays whose length changes from slice to slice and from frame to frame.
#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

namespace ball_sim::core::continuous {

/// A vector that does not double when it grows, and that gives back what it has not used for long.
template <class T>
class Buffer {
 public:
  using value_type = T;

  auto begin() { return values_.begin(); }
  auto end() { return values_.end(); }
  auto begin() const { return values_.begin(); }
  auto end() const { return values_.end(); }
  T& operator[](std::size_t i) { return values_[i]; }
  const T& operator[](std::size_t i) const { return values_[i]; }
  const T& front() const { return values_.front(); }
  T& back() { return values_.back(); }
  bool empty() const { return values_.empty(); }
  std::size_t size() const { return values_.size(); }
  std::size_t capacity() const { return values_.capacity(); }

  void push_back(const T& value) {
    if (values_.size() == values_.capacity()) makeRoomFor(values_.size() + 1);
    values_.push_back(value);
  }
  void pop_back() { values_.pop_back(); }

  void append(const Buffer& other) {
    makeRoomFor(values_.size() + other.size());
    values_.insert(values_.end(), other.begin(), other.end());
  }

  void resize(std::size_t size) {
    most_ = std::max(most_, values_.size());
    makeRoomFor(size);
    values_.resize(size);
  }

  void clear() {
    most_ = std::max(most_, values_.size());
    values_.clear();
  }

  void swap(Buffer& other) {
    values_.swap(other.values_);
    std::swap(most_, other.most_);
  }

  /// Keeps room for as many as there have been since the last call, and a few more. Where there is
  /// little too much nothing is done: what has settled is allocated no more.
  void giveBackRoom() {
    const std::size_t most = std::max(most_, values_.size());
    most_ = 0;
    if (values_.capacity() <= most + most / 2 + kFew) return;
    std::vector<T> values;
    values.reserve(most + most / 8);
    values.assign(values_.begin(), values_.end());
    values_.swap(values);
  }

 private:
  static constexpr std::size_t kFew = 1024 / sizeof(T);

  void makeRoomFor(std::size_t size) {
    if (size > values_.capacity()) values_.reserve(size + size / 8 + 1);
  }

  std::vector<T> values_;
  std::size_t most_ = 0;  // values, seen before they became fewer
};

}  // namespace ball_sim::core::continuous

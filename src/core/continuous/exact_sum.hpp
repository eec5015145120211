// A sum whose last digit does not depend on the order of its terms.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace ball_sim::core {

/// Adds numbers without rounding, in fixed point as wide as all doubles (Kulisch, "Computer
/// Arithmetic and Validity", 2008). A term costs three additions.
class ExactSum {
 public:
  /// @param term  finite, >= 0
  void add(double term) {
    static_assert(sizeof(double) == sizeof(std::uint64_t), "IEEE 754");
    std::uint64_t bits = 0;
    std::memcpy(&bits, &term, sizeof(bits));
    const std::uint64_t exponent = bits >> kFraction & kExponents;
    std::uint64_t digits = bits & ((std::uint64_t{1} << kFraction) - 1);
    if (exponent > 0) digits |= std::uint64_t{1} << kFraction;
    const std::uint64_t place = exponent > 0 ? exponent - 1 : 0;  // of the lowest digit
    const std::uint64_t low = (digits & kMask) << place % kWidth;
    const std::uint64_t high = (digits >> kWidth) << place % kWidth;
    std::uint64_t* const word = &words_[place / kWidth];
    word[0] += low & kMask;
    word[1] += (low >> kWidth) + (high & kMask);
    word[2] += high >> kWidth;
    if (++terms_ == kMostTerms) {
      carry(words_);
      terms_ = 1;
    }
  }

  /// The sum, to a rounding.
  double value() const {
    Words words = words_;
    carry(words);
    double sum = 0;
    for (std::size_t i = words.size(); i-- > 0;) {
      const int place = static_cast<int>(kWidth * i) - kLowest;
      sum += std::ldexp(static_cast<double>(words[i]), place);
    }
    return sum;
  }

 private:
  static constexpr int kFraction = 52;               // bits of a double
  static constexpr std::uint64_t kExponents = 2047;  // the largest
  static constexpr int kLowest = 1074;               // the least double is 2^-1074
  static constexpr std::uint64_t kWidth = 32;        // bits of a word; above is room for carries
  static constexpr std::uint64_t kMask = 0xFFFFFFFF;
  static constexpr std::uint32_t kMostTerms = std::uint32_t{1} << 30;  // of at most 2^33 a word

  using Words = std::array<std::uint64_t, kExponents / kWidth + 3>;  // lowest first

  static void carry(Words& words) {
    for (std::size_t i = 0; i + 1 < words.size(); ++i) {
      words[i + 1] += words[i] >> kWidth;
      words[i] &= kMask;
    }
  }

  Words words_{};
  std::uint32_t terms_ = 0;  // since words_ were carried
};

}  // namespace ball_sim::core

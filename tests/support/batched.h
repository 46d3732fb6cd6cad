#pragma once
// A function of one point as one of batches.

#include <functional>
#include <span>
#include <vector>

namespace isoshift {

template <class Function>
auto batched(Function function) {
  using Answer = std::invoke_result_t<Function, const std::vector<double>&>;
  return std::function<std::vector<Answer>(std::span<const std::vector<double>>)>(
      [function](std::span<const std::vector<double>> points) {
        std::vector<Answer> answers;
        for (const std::vector<double>& point : points) answers.push_back(function(point));
        return answers;
      });
}

}  // namespace isoshift

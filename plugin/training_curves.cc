// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/training_curves.h"

#include "plugin/table.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <vector>

namespace vgtw {
namespace {

struct Point {
  double step = 0.0;
  double value = 0.0;
};

struct Panel {
  std::string title;
  std::vector<Point> points;
  bool has_dots = false;  // few points, each of its own worth
};

// px
constexpr int kPanelWidth = 360;
constexpr int kPanelHeight = 220;
constexpr int kLeft = 62;
constexpr int kRight = 14;
constexpr int kTop = 34;
constexpr int kBottom = 30;
constexpr size_t kColumns = 3;

// Means of as many neighbours as leave at most 300.
std::vector<Point> Thin(const std::vector<Point>& points) {
  constexpr size_t kMaxPoints = 300;
  const size_t num_each = (points.size() + kMaxPoints - 1) / kMaxPoints;
  std::vector<Point> means;
  for (size_t begin = 0; begin < points.size(); begin += num_each) {
    const size_t end = std::min(points.size(), begin + num_each);
    Point mean;
    for (size_t i = begin; i < end; ++i) {
      mean.step += points[i].step;
      mean.value += points[i].value;
    }
    const auto num = static_cast<double>(end - begin);
    means.push_back({mean.step / num, mean.value / num});
  }
  return means;
}

// Left out where the figure is 0 throughout: it was not computed.
template <typename Entry, typename ValueOf>
void AddPanel(const std::string& title,
              const std::vector<Entry>& entries,
              const ValueOf& value_of,
              bool has_dots,
              std::vector<Panel>& panels) {
  Panel panel{title, {}, has_dots};
  bool is_used = false;
  for (const Entry& entry : entries) {
    panel.points.push_back({static_cast<double>(entry.step), value_of(entry)});
    is_used = is_used || panel.points.back().value != 0.0;
  }
  if (!is_used) return;
  if (!has_dots) panel.points = Thin(panel.points);
  panels.push_back(std::move(panel));
}

std::vector<Panel> PanelsOf(const TrainingLog& log) {
  std::vector<Panel> panels;
  const auto of_steps = [&](const std::string& title, const auto& value_of) {
    AddPanel(title, log.steps, value_of, /*has_dots=*/false, panels);
  };
  of_steps("loss, weighted sum", [](const TrainingStep& step) { return step.loss; });
  for (size_t i = 0; i < kNumTrainingLosses; ++i) {
    of_steps(kTrainingLossNames[i] + std::string(" loss"),
             [i](const TrainingStep& step) { return step.losses[i]; });
  }
  of_steps("learning rate", [](const TrainingStep& step) { return step.learning_rate; });
  for (const ScoreField& field : ScoreFields()) {
    const auto value_of = [&](const ValidationScore& score) { return score.*field.value; };
    AddPanel("held out: " + std::string(field.title),
             log.validations,
             value_of,
             /*has_dots=*/true,
             panels);
  }
  return panels;
}

// Maps values to pixels from the top of a panel.
class Axis {
 public:
  explicit Axis(const std::vector<Point>& points) {
    const auto less = [](const Point& a, const Point& b) { return a.value < b.value; };
    const auto [lowest, highest] = std::minmax_element(points.begin(), points.end(), less);
    low_ = lowest->value;
    high_ = highest->value;
    is_log_ = low_ > 0.0 && high_ > 20.0 * low_;
    if (low_ == high_) {  // a line in the middle
      low_ -= 0.5 * std::max(1e-12, std::abs(low_));
      high_ += 0.5 * std::max(1e-12, std::abs(high_));
    }
  }

  double Pixel(double value) const {
    const double share = (Scale(value) - Scale(low_)) / (Scale(high_) - Scale(low_));
    return kTop + (1.0 - share) * (kPanelHeight - kTop - kBottom);
  }

  // Lowest, middle of the axis, highest.
  std::vector<double> Ticks() const {
    const double middle = is_log_ ? std::sqrt(low_ * high_) : 0.5 * (low_ + high_);
    return {low_, middle, high_};
  }

 private:
  double Scale(double value) const { return is_log_ ? std::log(value) : value; }

  double low_ = 0.0;
  double high_ = 1.0;
  bool is_log_ = false;
};

std::string Shortest(double value) {
  std::ostringstream text;
  text.precision(3);
  text << value;
  return text.str();
}

void Text(double x, double y, const char* css, const std::string& text, std::ostream& svg) {
  svg << "<text class=\"" << css << "\" x=\"" << FormatNumber(x, 1) << "\" y=\""
      << FormatNumber(y, 1) << "\">" << text << "</text>\n";
}

void Draw(const Panel& panel, std::ostream& svg) {
  const double last_step = std::max(1.0, panel.points.back().step);
  const double right = kPanelWidth - kRight;
  const auto x_of = [&](double step) { return kLeft + step / last_step * (right - kLeft); };
  const Axis axis(panel.points);
  Text(kLeft, kTop - 14, "title", panel.title, svg);
  for (const double tick : axis.Ticks()) {
    const double y = axis.Pixel(tick);
    svg << "<path class=\"grid\" d=\"M" << kLeft << ' ' << FormatNumber(y, 1) << "H" << right
        << "\"/>\n";
    Text(kLeft - 6, y + 4, "tick", Shortest(tick), svg);
  }
  Text(right, kPanelHeight - kBottom + 18, "tick", "step " + FormatNumber(last_step, 0), svg);
  svg << "<polyline points=\"";
  for (const Point& point : panel.points) {
    svg << FormatNumber(x_of(point.step), 1) << ',' << FormatNumber(axis.Pixel(point.value), 1)
        << ' ';
  }
  svg << "\"/>\n";
  if (!panel.has_dots) return;
  for (const Point& point : panel.points) {
    svg << "<circle cx=\"" << FormatNumber(x_of(point.step), 1) << "\" cy=\""
        << FormatNumber(axis.Pixel(point.value), 1) << "\" r=\"2.5\"/>\n";
  }
}

constexpr char kStyle[] =
    "<style>text{font:12px sans-serif;fill:#333}.title{font-weight:bold}.tick{text-anchor:end;"
    "fill:#666}.grid{stroke:#ddd}polyline{fill:none;stroke:#1f6fb4;stroke-width:1.5}"
    "circle{fill:#1f6fb4}</style>\n";

}  // namespace

std::string DrawTrainingCurves(const TrainingLog& log) {
  const std::vector<Panel> panels = PanelsOf(log);
  if (panels.empty()) return {};
  const size_t num_rows = (panels.size() + kColumns - 1) / kColumns;
  std::ostringstream svg;
  svg << "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"" << kColumns * kPanelWidth
      << "\" height=\"" << num_rows * kPanelHeight << "\">\n"
      << kStyle << "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n";
  for (size_t i = 0; i < panels.size(); ++i) {
    svg << "<g transform=\"translate(" << i % kColumns * kPanelWidth << ','
        << i / kColumns * kPanelHeight << ")\">\n";
    Draw(panels[i], svg);
    svg << "</g>\n";
  }
  svg << "</svg>\n";
  return svg.str();
}

}  // namespace vgtw

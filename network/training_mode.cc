// SPDX-License-Identifier: BSD-3-Clause
#include "network/training_mode.h"

#include "scene/random.h"

#include <utility>

#include <ATen/ATen.h>
#include <ATen/CPUGeneratorImpl.h>
#include <torch/csrc/autograd/autograd.h>
#include <torch/csrc/autograd/custom_function.h>
#include <torch/custom_class.h>

namespace vgtw {
namespace {

thread_local TrainingMode* current_mode = nullptr;

// Numbers in [0, 1) on the device of `like`.
at::Tensor UniformLike(const at::Tensor& like, uint64_t seed) {
  const at::TensorOptions options = like.options().dtype(at::kFloat);
  if (like.is_cpu()) return at::rand(like.sizes(), at::detail::createCPUGenerator(seed), options);
  at::Generator generator = at::globalContext().defaultGenerator(like.device());
  generator.set_current_seed(seed);
  return at::rand(like.sizes(), generator, options);
}

// A block and the mode in which it ran forward, which the thread of the backward pass need not be
// in.
struct Recomputation : torch::CustomClassHolder {
  BlockFunction block;
  TrainingMode mode;
};

struct RecomputedBlock : torch::autograd::Function<RecomputedBlock> {
  // `gate` requires a gradient: so this node is asked for one where x requires none, but parameters
  // do.
  static at::Tensor forward(torch::autograd::AutogradContext* context,
                            const at::Tensor& x,
                            const at::Tensor& /*gate*/,
                            c10::intrusive_ptr<Recomputation> recomputation) {
    context->save_for_backward({x});
    context->saved_data["recomputation"] = c10::IValue::make_capsule(recomputation);
    return recomputation->block(x);
  }

  static torch::autograd::variable_list backward(torch::autograd::AutogradContext* context,
                                                 torch::autograd::variable_list gradients) {
    const c10::intrusive_ptr<torch::CustomClassHolder> capsule =
        context->saved_data["recomputation"].toCapsule();
    const auto& recomputation = static_cast<const Recomputation&>(*capsule);
    const at::AutoGradMode with_gradients(true);
    const TrainingModeScope scope(recomputation.mode);
    const at::Tensor x = context->get_saved_variables()[0].detach().requires_grad_();
    torch::autograd::backward({recomputation.block(x)}, {gradients[0]});
    return {x.grad(), at::Tensor(), at::Tensor()};
  }
};

}  // namespace

TrainingModeScope::TrainingModeScope(const TrainingMode& mode)
    : mode_(mode), previous_(std::exchange(current_mode, &mode_)) {}

TrainingModeScope::~TrainingModeScope() { current_mode = previous_; }

at::Tensor DropLoraInputs(const at::Tensor& x) {
  if (current_mode == nullptr || current_mode->lora_dropout <= 0.0) return x;
  const double dropped = current_mode->lora_dropout;
  const uint64_t seed = HashKey({current_mode->dropout_seed, current_mode->num_dropouts++});
  return x * (UniformLike(x, seed) >= dropped).to(x.scalar_type()) / (1.0 - dropped);
}

at::Tensor RunBlock(BlockFunction block, const at::Tensor& x) {
  const bool recomputes =
      current_mode != nullptr && current_mode->recompute_blocks && at::GradMode::is_enabled();
  if (!recomputes) return block(x);
  auto recomputation = c10::make_intrusive<Recomputation>();
  recomputation->block = std::move(block);
  recomputation->mode = *current_mode;
  const at::Tensor gate = at::zeros({}, x.options().dtype(at::kFloat)).requires_grad_();
  return RecomputedBlock::apply(x, gate, std::move(recomputation));
}

}  // namespace vgtw

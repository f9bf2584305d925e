!> Frictionless contact, from coarse to fine lattices.
!>
!> The first guess comes from the solution on the lattice of every second node,
!> and so on down to a few nodes.
module hc_normal_contact
  use hc_precision, only: wp
  use hc_error, only: error_t
  use hc_lattice, only: lattice_t
  use hc_elastic_pair, only: elastic_pair_t
  use hc_fftw, only: good_size
  use hc_convolution_single, only: convolution_memory
  use hc_flexibility_fft, only: fft_memory
  use hc_normal_kernel, only: normal_kernel_t, new_normal_kernel
  use hc_contact_state, only: contact_state_t, check_problem
  use hc_preconditioner, only: preconditioner_memory
  use hc_normal_level, only: normal_level_t
  use hc_multilevel, only: level_count, prolong_edge, restrict_field, restrict_mask
  implicit none
  private

  public :: normal_contact_t, new_normal_contact, normal_contact_memory

  !> Windows below this many nodes a side are not coarsened any further.
  integer, parameter :: smallest_side = 40
  !> Coarse lattices only have to give a start.
  real(wp), parameter :: coarse_tolerance = 3.0e-2_wp

  !> A frictionless contact problem on a hierarchy of lattices.
  type :: normal_contact_t
    private
    !> From the finest to the coarsest lattice
    type(normal_level_t), allocatable :: level(:)
  contains
    !> Solve for a normal load or an approach
    procedure :: solve
  end type normal_contact_t

contains

  !> Operators of a problem on all its lattices.
  subroutine new_normal_contact(self, lattice, pair, initial_gap, candidate, error, n_threads)
    !> Problem to be set up
    type(normal_contact_t), intent(out) :: self
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Elastic constants of the two bodies
    type(elastic_pair_t), intent(in) :: pair
    !> Initial gap (n_col, n_row) [m]
    real(wp), intent(in) :: initial_gap(:, :)
    !> Nodes that may come into contact (n_col, n_row)
    logical, intent(in) :: candidate(:, :)
    !> Allocated on failure: wrong shapes, no candidate at all, not enough memory
    type(error_t), allocatable, intent(out) :: error
    !> Threads to use; absent or 0: as many as OpenMP would take
    integer, intent(in), optional :: n_threads

    type(normal_kernel_t) :: kernel
    integer :: l

    call check_problem(lattice, initial_gap, candidate, error)
    if (allocated(error)) return
    allocate (self%level(level_count(lattice%extent, smallest_side)))
    do l = 1, size(self%level)
      associate (level => self%level(l))
        if (l == 1) then
          level%lattice = lattice
          level%initial_gap = initial_gap
          level%candidate = candidate
        else
          associate (finer => self%level(l - 1))
            level%lattice = finer%lattice%coarsened()
            level%initial_gap = restrict_field(finer%lattice, finer%initial_gap, level%lattice)
            level%candidate = restrict_mask(finer%lattice, finer%candidate, level%lattice)
          end associate
        end if
        if (l == 1) call new_normal_kernel(kernel, lattice, pair%lambda_1, n_threads)
        ! the kernel grows with the spacing
        kernel%factor = pair%lambda_1*2.0_wp**(l - 1)
        call level%prepare(pair, kernel, l == 1, error, n_threads)
        if (allocated(error)) return
      end associate
    end do
  end subroutine new_normal_contact

  !> Bytes that a problem takes, for a window of the given size.
  pure integer(selected_int_kind(18)) function normal_contact_memory(extent, n_threads)
    !> Number of columns and rows of the window
    integer, intent(in) :: extent(2)
    !> Threads to use
    integer, intent(in) :: n_threads
    integer, parameter :: long = selected_int_kind(18)
    integer(long) :: finest

    ! fields: gap, candidates, state, what an iteration needs, and the kernel
    finest = fft_memory(extent, .true., n_threads) + preconditioner_memory(extent, n_threads, .false.) &
             + convolution_memory(extent, good_size(2*extent - 1), 1, 1, n_threads) &
             + 16*8*int(extent(1), long)*extent(2) + 8*int(maxval(extent), long)**2
    normal_contact_memory = finest + finest/3
  end function normal_contact_memory

  !> Solve for a normal load or an approach.
  subroutine solve(self, control, target, tolerance, max_sweeps, state, error)
    class(normal_contact_t), intent(inout), target :: self
    !> force_control or displacement_control
    integer, intent(in) :: control
    !> Normal load [N] or approach [m]
    real(wp), intent(in) :: target
    !> Bound of both residuals
    real(wp), intent(in) :: tolerance
    !> Active sets that may be tried on each lattice
    integer, intent(in) :: max_sweeps
    !> Solution; `converged` tells whether the residuals are within the tolerance
    type(contact_state_t), intent(out) :: state
    !> Allocated on failure: an operator that is not positive definite
    type(error_t), allocatable, intent(out) :: error

    type(contact_state_t) :: coarse
    real(wp) :: work
    integer :: l

    work = 0.0_wp
    do l = size(self%level), 1, -1
      associate (level => self%level(l))
        if (.not. any(level%candidate)) cycle
        allocate (state%pressure(level%lattice%extent(1), level%lattice%extent(2)), source=0.0_wp)
        if (allocated(coarse%pressure)) then
          call prolong_edge(self%level(l + 1)%lattice, coarse%pressure, level%lattice, state%pressure)
        else
          where (level%candidate) state%pressure = 1.0_wp
        end if
        call level%solve(control, target, merge(tolerance, max(tolerance, coarse_tolerance), l == 1), max_sweeps, state, error)
        if (allocated(error)) return
        work = work + real(level%lattice%size(), wp)/self%level(1)%lattice%size()*level%work()
        if (l > 1) call move_alloc(state%pressure, coarse%pressure)
      end associate
    end do
    state%operator_applications = work
  end subroutine solve

end module hc_normal_contact
